"""What the commands share: flags, requests, output, pictures."""
