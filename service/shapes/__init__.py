"""`/v1/shapes`: interpolated shapes, one by one and in batches."""
