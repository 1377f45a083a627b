// Titles and captions of tours in several languages.
import { describe, expect, it } from 'vitest';
import { identity, type Vec3 } from '#client/base/vector';
import { TourDraft } from '#client/tour/draft';
import { read_tours, tours_for, write_tours, type Stop, type Tour } from '#client/tour/tour';
import { untranslated, worded, words_for } from '#client/tour/words';

const up: Vec3 = [0, -1, 0];

describe('tours in several languages', () => {
  it('speak the language of the visitor where they can, text by text', () => {
    const place = { position: [0, 0, 0], orientation: [0, 0, 0, 1] };
    const translations = {
      de: { title: 'Halle', caption: '1904 erbaut.' },
      'zh-Hans': { title: '大厅' },
      nl: {},
    };
    const stops = [
      { ...place, title: 'Hall', caption: 'Built in 1904.', translations },
      { ...place, title: 'Stairs' },
    ];
    const tours = read_tours(
      [{ title: 'Ground floor', translations: { de: { title: 'Erdgeschoss' } }, stops }],
      up,
      1,
    );
    const read = (...readers: string[]): (string | undefined)[] =>
      tours_for(tours, readers).flatMap((tour) =>
        [tour, ...tour.stops].flatMap((item) => [item.title, item.caption, item.language]),
      );
    const own = ['Ground floor', undefined, ''];
    expect(read('en')).toEqual([...own, 'Hall', 'Built in 1904.', '', 'Stairs', '', '']);
    expect(read('de-CH', 'de')).toEqual([
      'Erdgeschoss',
      undefined,
      'de',
      'Halle',
      '1904 erbaut.',
      'de',
      'Stairs',
      '',
      '',
    ]);
    expect(read('zh-TW', 'zh-Hans')).toEqual([
      ...own,
      '大厅',
      'Built in 1904.',
      'zh-Hans',
      'Stairs',
      '',
      '',
    ]);
    expect(read('ZH-HANS')[3]).toBe('大厅');
    expect(read('nl', 'de').slice(3, 6)).toEqual(['Hall', 'Built in 1904.', 'nl']);
    // What an author does not edit is saved as it was.
    const [written] = write_tours(tours) as {
      translations: object;
      stops: { translations?: object }[];
    }[];
    expect(written).toMatchObject({ translations: { de: { title: 'Erdgeschoss' } } });
    expect(written!.stops.map((stop) => stop.translations)).toEqual([
      { de: translations.de, 'zh-Hans': translations['zh-Hans'] },
      undefined,
    ]);
    expect(read_tours([written], up, 1)[0]!.stops[0]!.translations.get('de')).toEqual(
      translations.de,
    );
  });

  it.each([
    [[{ stops: [], translations: [] }], undefined],
    [[{ stops: [], translations: 'de' }], 'tours[0].translations: is not an object'],
    [
      [{ stops: [], translations: { de: { title: 1 } } }],
      'tours[0].translations.de.title: is not text',
    ],
    [
      [
        {
          stops: [],
          translations: Object.fromEntries(Array.from({ length: 33 }, (_, i) => [`x${i}`, {}])),
        },
      ],
      'has 33 entries, at most 32',
    ],
    [
      [{ stops: [], translations: JSON.parse('{"__proto__": {"title": "x"}}') as object }],
      undefined,
    ],
  ])('have translations that can be read: %j', (document, complaint) => {
    const read = (): Tour[] => read_tours(document, up, 1);
    if (complaint === undefined) expect(read()).toHaveLength(1);
    else expect(read).toThrow(complaint);
  });
});

describe('the languages of an author', () => {
  const hall: Stop = {
    title: 'Hall',
    caption: 'about Hall',
    ...untranslated,
    eye: { position: [1, 2, 3], orientation: identity, fov_y_rad: 1 },
    marker: undefined,
    stay_s: undefined,
    fly_s: undefined,
    portal: undefined,
  };
  const draft = (): TourDraft => {
    const made = new TourDraft();
    made.add({ ...hall, translations: new Map([['fr', { title: 'Le hall', caption: '' }]]) });
    return made;
  };
  const write = (made: TourDraft, language: string, change: Partial<Stop>): void =>
    made.change(
      0,
      worded(made.stops[0]!, language, change),
      `${Object.keys(change).join()} 0 ${language}`,
    );

  it('are edited one by one', () => {
    const made = draft();
    write(made, 'de', { title: 'H' });
    write(made, 'de', { title: 'Halle' });
    write(made, 'de', { caption: 'Von 1904.' });
    write(made, '', { title: 'The hall' });
    write(made, 'de', { stay_s: 5 });
    const edited = made.stops[0]!;
    expect(edited).toMatchObject({ title: 'The hall', caption: 'about Hall', stay_s: 5 });
    expect(words_for(edited, '')).toEqual({ title: 'The hall', caption: 'about Hall' });
    expect(words_for(edited, 'de')).toEqual({ title: 'Halle', caption: 'Von 1904.' });
    expect(words_for(edited, 'fr')).toEqual({ title: 'Le hall', caption: '' });
    expect(words_for(edited, 'ja')).toEqual({ title: '', caption: '' });
    for (let i = 0; i < 4; ++i) made.undo();
    expect(words_for(made.stops[0]!, 'de')).toEqual({ title: '', caption: '' }); // typing was one edit
    expect(made.stops[0]!.title).toBe('Hall');
  });
});
