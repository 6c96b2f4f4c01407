"""What a person reads of a campaign: its page, and the comment on a pull request."""
