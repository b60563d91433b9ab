"""The aircraft, its servos and sensors, and what goes wrong with them."""
