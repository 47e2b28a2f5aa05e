"""Commands of the command line with their options, a module each."""
