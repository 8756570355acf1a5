"""Run-time assurance: what stands between an untrusted pilot and the vehicle (the pattern of ASTM F3269)."""
