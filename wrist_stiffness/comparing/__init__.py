"""How far models are off from measured sessions, where, and on what that depends."""
