"""What of the bench a page shows by its name: run folders, and runs that go on."""
