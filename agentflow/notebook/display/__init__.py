"""How notebooks show things: HTML, pictures and progress; nothing else needs IPython."""
