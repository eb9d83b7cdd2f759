"""What readers and writers share: accounts, checks before a file is trusted, JSON, result folders."""
