"""A page that runs a firmware in a browser: the emulator's C as WebAssembly, without Python (docs/browser.md)."""
