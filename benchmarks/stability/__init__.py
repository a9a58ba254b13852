"""Who fails where: hard cases with exact answers."""
