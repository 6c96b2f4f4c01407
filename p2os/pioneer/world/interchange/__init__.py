"""What readers and writers of other programs' files share: poses as matrices, our own words, glTF's container."""
