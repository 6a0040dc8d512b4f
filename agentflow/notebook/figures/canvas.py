"""The figure itself; imports matplotlib."""

import io

from matplotlib.figure import Figure


class PaperFigure(Figure):
    """A figure without a window, which notebooks show."""

    def _repr_png_(self) -> bytes:
        """What notebooks show."""
        content = io.BytesIO()
        self.savefig(content, format="png", dpi=160)
        return content.getvalue()
