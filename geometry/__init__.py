"""What a surface is: meshes, and everything derived from them."""
