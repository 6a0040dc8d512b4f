"""Reports: what a run has recorded, as one self-contained page. No physics: films are handed in."""
