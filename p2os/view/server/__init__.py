"""The page, served: who may look, what each page is sent, and the server itself. Needs the extra `view`."""
