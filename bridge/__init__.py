"""Everything that crosses a process: messages, topics, transports, config, launching, CLI."""
