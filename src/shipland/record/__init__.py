"""The flight log: one row a cycle, pictures beside it, written as MCAP and read back."""
