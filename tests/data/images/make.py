"""Makes the pictures of this folder and, as X.rgb (rows of R, G, B bytes), what PIL's convert('RGB') gives.

Run with Python 3 and Pillow; the committed files were made with Pillow 13.0.
"""

import pathlib

import numpy as np
from PIL import Image

HERE = pathlib.Path(__file__).parent
HEIGHT, WIDTH = 16, 24


def gradient():
    """A smooth colour picture (JPEG keeps it well) whose corners tell any rotation or mirroring apart."""
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH]
    red = 10 * x
    green = 15 * y
    blue = 255 - 5 * (x + y)
    return np.stack([red, green, blue], axis=-1).clip(0, 255).astype(np.uint8)


def save(name, image, **options):
    image.save(HERE / name, **options)
    (HERE / (name + ".rgb")).write_bytes(Image.open(HERE / name).convert("RGB").tobytes())


def main():
    rgb = gradient()
    colour = Image.fromarray(rgb)
    grey = colour.convert("L")
    alpha = Image.fromarray((np.arange(HEIGHT * WIDTH) % 256).astype(np.uint8).reshape(HEIGHT, WIDTH))

    save("rgb.png", colour)
    save("grey.png", grey)
    save("grey_alpha.png", Image.merge("LA", (grey, alpha)))
    save("rgba.png", Image.merge("RGBA", (*colour.split(), alpha)))
    save("one_bit.png", grey.convert("1"))
    palette = colour.quantize(16)
    save("palette.png", palette)
    save("palette_transparent.png", palette, transparency=3)
    save("grey.jpg", grey, quality=90)
    save("rgb.jpg", colour, quality=90)
    save("rgb_444.jpg", colour, quality=90, subsampling=0)
    save("progressive.jpg", colour, quality=90, progressive=True)
    save("cmyk.jpg", colour.convert("CMYK"), quality=95)
    exif = Image.Exif()
    exif[0x0112] = 6  # "turn by 90 degrees": must not be followed
    save("exif_turned.jpg", colour, quality=90, exif=exif)
    save("png_inside.jpg", colour, format="PNG")

    # 16 bits: the expected picture is the high byte of each number.
    wide = (np.asarray(grey).astype(np.uint16) << 8) | 0x5A
    Image.fromarray(wide).save(HERE / "grey_16.png")
    (HERE / "grey_16.png.rgb").write_bytes(np.repeat(np.asarray(grey)[..., None], 3, axis=-1).tobytes())


if __name__ == "__main__":
    main()
