"""What lies between recorded commands and the truck: links, limits, aids, pedals."""
