"""Parts that the commands share: flags, requests, output, pictures."""
