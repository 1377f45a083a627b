/** Ways to decode, best first; the last one needs no video decoder. */
export const decoder_ladder = [
  'prefer-hardware',
  'no-preference',
  'prefer-software',
  'jpeg',
] as const;

export type DecoderRung = (typeof decoder_ladder)[number];

/** The rungs from `first` down. */
export function rungs_from(first: DecoderRung): readonly DecoderRung[] {
  return decoder_ladder.slice(decoder_ladder.indexOf(first));
}
