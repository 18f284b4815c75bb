"""A result as one self-contained page: content (`model`, `scene`) and conversion to HTML (`html`)."""
