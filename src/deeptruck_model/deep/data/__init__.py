"""Recordings come in; K-step sequences go out, scaled, with what they cover and what was never excited."""
