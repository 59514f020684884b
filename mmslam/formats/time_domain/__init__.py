"""What is not a stepped sweep: traces over time, beats of a chirp, and recorders' own files."""
