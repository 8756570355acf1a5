"""What is flown and how it is judged: scenarios, one flight, campaigns, rules."""
