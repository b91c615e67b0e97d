"""From images to the people in them."""
