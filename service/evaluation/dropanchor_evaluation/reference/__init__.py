"""The reference pages in `service/docs/reference`, generated from what they describe."""
