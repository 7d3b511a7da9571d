// Arithmetic for light and dark themes. Colours are numbers, 0xrrggbb, or codes, "#rrggbb".

export const toNumber = (code) => parseInt(code.slice(1), 16);
export const toCode = (number) => `#${number.toString(16).padStart(6, "0")}`;
export const toChannels = (number) => [number >> 16, number >> 8 & 255, number & 255];

// Colour -> its shade in the dark, of a picture that was made for the background `name`.
// backgrounds: name -> codes of top, bottom, the ground's lines and text. shades: code -> code.
export function darkShades({backgrounds, shades}, name) {
  const [paper, , lines, text] = backgrounds[name];
  const [darkPaper, , darkLines, darkText] = backgrounds.dark;
  const own = [[lines, darkLines], [text, darkText], [paper, darkPaper]];
  return new Map([...Object.entries(shades), ...own].map((pair) => pair.map(toNumber)));
}

// Whether a CSS colour, such as rgb(255, 255, 255) or color(srgb 1 1 1), is light.
export function isLight(style) {
  const full = style.startsWith("color(") ? 1 : 255;
  const [red, green, blue] = style.match(/[\d.]+/g).map(Number);
  return 0.3 * red + 0.59 * green + 0.11 * blue > 0.5 * full;
}

// A label's pixels are grey and alpha in turn. Whether it has dark letters, on a light plate.
export function hasDarkLetters(pixels) {
  return pixels.some((grey, i) => i % 2 === 0 && pixels[i + 1] === 255 && grey < 128);
}

// Copy a label's pixels into `target`, its greys inverted where `invert` is true.
export function copyGreys(pixels, target, invert) {
  for (let i = 0; i < pixels.length; i += 2) target[i] = invert ? 255 - pixels[i] : pixels[i];
}
