"""Many runs that are judged together."""
