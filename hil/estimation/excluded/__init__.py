"""Test of recordings for causes of error: found, excluded and invisible causes."""
