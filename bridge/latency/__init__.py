"""How old a command is when it comes: newest frame to command on the wire, through the real processes."""
