/** A scale bar: the longest round length that fits. */

export function scaleBar(metresPerPixel: number, room = 120): { metres: number; pixels: number; text: string } {
  const widest = Math.max(1e-6, room * metresPerPixel);
  const power = 10 ** Math.floor(Math.log10(widest));
  const metres = ([5, 2, 1].find((factor) => factor * power <= widest) ?? 1) * power;
  const text = metres >= 1000 ? `${metres / 1000} km` : metres >= 1 ? `${metres} m` : `${Math.round(metres * 100)} cm`;
  return { metres, pixels: metres / metresPerPixel, text };
}
