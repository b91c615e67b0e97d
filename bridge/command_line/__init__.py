"""What all commands share: their options, where their output goes, what the shell completes."""
