"""What happens in a run, as one typed stream: recorded, judged and shown by whoever subscribes."""
