"""What else locates a user, after the thesis' introduction: one method a file, on our scenes."""
