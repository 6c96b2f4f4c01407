"""Hardware of the project, described as code; the packages of the simulation never import it."""
