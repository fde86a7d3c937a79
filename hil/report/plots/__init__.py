"""The pictures of reports and studies."""
