"""What a drive is judged by."""
