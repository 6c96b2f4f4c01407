"""What programs with verbs have in common: errors in a line, exit codes, signals, pages of help."""
