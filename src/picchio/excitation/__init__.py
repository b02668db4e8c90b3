"""The blows of the tool: F(t), in pieces that have a closed form."""
