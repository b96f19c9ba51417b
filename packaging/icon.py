"""Draws packaging/model.png, the icon of the FMUs: two discs that are about to touch."""

from pathlib import Path

from PIL import Image, ImageDraw

SIZE, FINE = 96, 8


def main() -> None:
    size = SIZE * FINE
    image = Image.new("RGBA", (size, size), (0, 0, 0, 0))
    draw = ImageDraw.Draw(image)

    def box(x0: float, y0: float, x1: float, y1: float, colour: str) -> None:
        draw.rounded_rectangle([x * size for x in (x0, y0, x1, y1)], radius=0.02 * size, fill=colour)

    box(0.04, 0.44, 0.34, 0.56, "#44546a")  # crankshaft
    box(0.66, 0.44, 0.96, 0.56, "#44546a")  # driveline
    box(0.26, 0.06, 0.42, 0.94, "#44546a")  # flywheel
    box(0.58, 0.14, 0.70, 0.86, "#7f8ea3")  # disc
    box(0.53, 0.14, 0.58, 0.40, "#d9691e")  # facings
    box(0.53, 0.60, 0.58, 0.86, "#d9691e")
    image = image.resize((SIZE, SIZE), Image.LANCZOS)
    image.save(Path(__file__).with_name("model.png"), optimize=True)


if __name__ == "__main__":
    main()
