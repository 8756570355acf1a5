"""MuJoCo's side: bodies, the driven deck, contacts, the touchdown's verdict."""
