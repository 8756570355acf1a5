"""Our ship world as the physics of an autopilot that flies in software in the loop."""
