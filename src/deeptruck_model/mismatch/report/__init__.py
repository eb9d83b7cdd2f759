"""A verdict comes in; the page goes out: sentences, figures, and what to do now."""
