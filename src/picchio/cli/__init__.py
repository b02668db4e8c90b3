"""The `picchio` command, one file a subcommand."""
