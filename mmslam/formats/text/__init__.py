"""Text files of numbers: tables with named columns (RFC 4180 and its kin), and plain matrices."""
