"""The sonar ring: its geometry, which sensor fires when, and how it errs."""
