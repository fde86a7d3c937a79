"""What is found out about drives before they are trusted: who is there, and what each can do."""
