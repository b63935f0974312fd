"""The laws of nature that a true wrist may hide; `catalogue` lists them."""
