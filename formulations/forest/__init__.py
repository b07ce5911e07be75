"""Random forests that recognise the points of one full surface by the heat that stays near them."""
