"""What points of a campaign reach of a program: lines, branches, states; what has to be reached; the corpus."""
