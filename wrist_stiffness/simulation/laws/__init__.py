"""The laws of nature that a true wrist may hide, one file each; `catalogue` lists them."""
