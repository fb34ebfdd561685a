"""`/v1/jobs`: exact runs, asked for over HTTP."""
