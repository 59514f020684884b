"""The front door: the command line, the pipeline that joins the packages, the report."""
