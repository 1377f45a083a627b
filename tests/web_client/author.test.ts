import { describe, expect, it, vi } from 'vitest';
import { identity } from '#client/base/vector';
import { Picks } from '#client/session/picks';
import { nothing_said, TourDraft } from '#client/tour/draft';
import { save_sidecar, type SaveResult, type SidecarTag } from '#client/tour/save';
import { read_tours, type Stop, type Tour } from '#client/tour/tour';
import { texts_written } from '#client/text/translations';
import { untranslated } from '#client/tour/words';
import { expect_vec, scene } from './cameras';
import { FakeTime } from './fakes';

const stop = (title: string): Stop => ({
  title,
  caption: `about ${title}`,
  ...untranslated,
  eye: { position: [1, 2, 3], orientation: identity, fov_y_rad: 1 },
  marker: [0, 0, 9],
  stay_s: undefined,
  fly_s: undefined,
  portal: undefined,
});

const titles = (draft: TourDraft): string[] => draft.stops.map(({ title }) => title);

describe('a draft of a tour', () => {
  it('grows, is put in order, and shrinks', () => {
    const draft = new TourDraft();
    for (const name of ['a', 'b', 'c']) draft.add(stop(name));
    draft.move(2, -1);
    expect(titles(draft)).toEqual(['a', 'c', 'b']);
    draft.move(0, -1);
    draft.move(2, 1);
    expect(titles(draft)).toEqual(['a', 'c', 'b']);
    draft.change(1, { title: 'C' });
    draft.remove(0);
    expect(titles(draft)).toEqual(['C', 'b']);
    expect(draft.stops[0]!.caption).toBe('about c');
  });

  it('knows the first picture that nobody has described', () => {
    const medium = (src: string, kind: 'image' | 'video', alt: string): object => ({
      src,
      kind,
      alt,
    });
    const with_media = (...media: object[]): Stop => ({
      ...stop('s'),
      media: media as unknown as Stop['media'],
    });
    const draft = new TourDraft();
    draft.add(
      with_media(medium('roof.jpg', 'image', 'A roof'), medium('opening.mp4', 'video', '')),
    );
    expect(draft.undescribed).toBeUndefined();
    draft.add_tour();
    draft.add(stop('first'));
    draft.add(with_media(medium('roof.jpg', 'image', 'A roof'), medium('door.jpg', 'image', '')));
    draft.choose(0);
    expect(draft.undescribed).toEqual({ tour: 1, stop: 1, medium: 1 });
  });

  it('is taken back edit by edit, and typing is one edit', () => {
    const draft = new TourDraft();
    const first = draft.state;
    expect(draft.can_undo).toBe(false);
    draft.add(stop('a'));
    for (const title of ['H', 'Ha', 'Hall']) draft.change(0, { title }, 'title 0');
    draft.edit_about({ credits: 'A' }, 'credits');
    draft.edit_about({ credits: 'Ada' }, 'credits');
    draft.add_tour();
    draft.edit({ start: stop('a').eye });
    draft.remove_tour();
    expect(draft.tour.title).toBe('');
    draft.undo(); // the removal
    expect(draft.state.start).toEqual(stop('a').eye);
    draft.undo();
    expect(draft.state.start).toBeUndefined();
    draft.undo();
    expect(draft.state.tours).toHaveLength(1);
    draft.undo();
    expect(draft.state.about.credits).toBe('');
    expect(titles(draft)).toEqual(['Hall']);
    draft.undo();
    expect(titles(draft)).toEqual(['a']);
    draft.undo();
    expect(draft.state).toBe(first);
    draft.undo();
    expect(draft.state).toBe(first);
    for (let i = 0; i < 300; ++i) draft.add_tour();
    for (let i = 0; i < 300; ++i) draft.undo();
    expect(draft.state.tours).toHaveLength(101); // the oldest edits are forgotten
  });

  it('has several tours, one of which is edited', () => {
    const draft = new TourDraft();
    draft.add(stop('a'));
    draft.add_tour();
    expect(draft.stops).toEqual([]);
    expect(draft.shown_index).toBe(-1);
    draft.add(stop('b'));
    expect(draft.shown_index).toBe(1);
    draft.choose(0);
    expect(titles(draft)).toEqual(['a']);
    draft.remove_tour();
    expect(titles(draft)).toEqual(['b']);
    draft.remove_tour();
    expect(draft.shown).toEqual([]);
    expect(draft.editable).toEqual([0]);
  });

  it('keeps the other tours, and is none without stops', () => {
    const film: Tour = {
      title: 'film',
      ...untranslated,
      stops: [],
      way: { duration_s: 1, repeats: false, at: () => stop('x').eye },
      starts_itself: false,
    };
    const second: Tour = {
      title: 'second',
      ...untranslated,
      stops: [stop('s')],
      way: undefined,
      starts_itself: false,
    };
    const draft = new TourDraft();
    draft.load([film, { ...second, title: 'first', starts_itself: true }, second], nothing_said);
    expect(draft.tour).toMatchObject({ title: 'first', starts_itself: true });
    expect(draft.editable).toEqual([1, 2]);
    expect(draft.shown.map(({ title }) => title)).toEqual(['film', 'first', 'second']);
    draft.remove(0);
    expect(draft.shown.map(({ title }) => title)).toEqual(['film', 'second']);
  });

  it('becomes a whole sidecar, which reads back', () => {
    const draft = new TourDraft();
    draft.edit_tour({ title: 'Mine' });
    draft.add({ ...stop('a'), stay_s: 8, fly_s: 2 });
    expect(draft.sidecar(scene)).not.toHaveProperty('background');
    draft.edit_about({ title: 'Hall', credits: 'Ada', mode: 'walk', background: '#ffffff' });
    expect(draft.sidecar(scene)).toMatchObject({
      up: [0, -1, 0],
      start_pose: { position: [0, 0, -5] },
      near: 0.2,
      limits: { min: [-20, -20, -20] },
      focus: [0, 0, 0],
      title: 'Hall',
      credits: 'Ada',
      mode: 'walk',
      background: '#ffffff',
    });
    expect(draft.sidecar(scene)).not.toHaveProperty('licence');
    expect(draft.sidecar(scene)).not.toHaveProperty('translations');
    const { about } = draft.state;
    draft.edit_about(texts_written(about, 'de', { title: 'Halle' }, { title: '', credits: '' }));
    expect(draft.sidecar(scene)).toMatchObject({
      title: 'Hall',
      translations: { de: { title: 'Halle' } },
    });
    const start_pose = { ...scene.start_pose, position: [7, 7, 7] as const };
    const section = [1, 2, 3, 4, 5, 6, 30];
    draft.change(0, { section });
    const over = { ...scene, up: [0, 1, 0] as const };
    for (const [own_up, turn_deg] of [
      [undefined, 30],
      [scene.up, -30], // the author has turned the scene over
    ] as const) {
      const [tour] = (draft.sidecar(over, own_up) as { tours: { stops: Partial<Stop>[] }[] }).tours;
      expect_vec(tour!.stops[0]!.section!, [...section.slice(0, 6), turn_deg]);
    }
    const sidecar = draft.sidecar({
      ...scene,
      start_pose,
      limits_min: [0, 0, 0],
      limits_max: [0, 0, 0],
    });
    expect(sidecar).not.toHaveProperty('limits');
    expect(sidecar).toMatchObject({ start_pose: { position: [7, 7, 7] } });
    const { tours } = JSON.parse(JSON.stringify(sidecar)) as { tours: unknown };
    const [tour] = read_tours(tours, [0, -1, 0], 1);
    expect(tour).toMatchObject({ title: 'Mine' });
    expect(tour!.stops[0]).toMatchObject({
      title: 'a',
      caption: 'about a',
      marker: [0, 0, 9],
      stay_s: 8,
      fly_s: 2,
    });
  });
});

describe('saving to the server', () => {
  const save = (
    answer: () => Promise<Response>,
    sidecar = '{}',
    made_from: SidecarTag = undefined,
  ): Promise<SaveResult> => {
    vi.stubGlobal('fetch', answer);
    const page = 'https://tours.example/?author';
    return save_sidecar(page, 'secret', 'old hall', sidecar, made_from);
  };
  const answered =
    (status: number, text: string, headers = {}) =>
    (): Promise<Response> =>
      Promise.resolve(new Response(text, { status, headers }));

  it('sends it with the token, to the scene', async () => {
    const fetched = vi.fn(answered(200, 'saved', { etag: '"2"' }));
    expect(await save(fetched)).toEqual({ kind: 'saved', tag: '"2"' });
    expect(fetched.mock.calls[0]).toMatchObject([
      new URL('https://tours.example/api/scenes/old%20hall/sidecar'),
      { method: 'PUT', headers: { 'catgs-token': 'secret' } },
    ]);
  });

  it.each([
    ['"1"', '"1"', undefined],
    [null, undefined, '*'],
    [undefined, undefined, undefined],
  ])('replaces only what it was made from: %s', async (made_from, match, none_match) => {
    const fetched = vi.fn<(address: URL, request: RequestInit) => Promise<Response>>(
      answered(412, '412: somebody else saved', { etag: '"7"' }),
    );
    expect(await save(fetched as never, '{}', made_from)).toEqual({ kind: 'changed', tag: '"7"' });
    const { headers } = fetched.mock.calls[0]![1];
    expect(new Headers(headers).get('if-match') ?? undefined).toBe(match);
    expect(new Headers(headers).get('if-none-match') ?? undefined).toBe(none_match);
  });

  it('says in plain words why it was not saved', async () => {
    const refused = (why: unknown): unknown => ({ kind: 'refused', why });
    expect(await save(answered(403, '403: this link does not let you save\n'))).toEqual(
      refused('this link does not let you save'),
    );
    expect(await save(answered(502, '<html>Bad gateway</html>'))).toEqual(refused('status 502'));
    expect(await save(() => Promise.reject(new TypeError('failed')))).toEqual(
      refused('the server does not answer'),
    );
    const fetched = vi.fn(answered(200, ''));
    expect(await save(fetched, ' '.repeat(2 ** 20 + 1))).toEqual(
      refused(expect.stringMatching(/too many/)),
    );
    expect(fetched).not.toHaveBeenCalled();
  });
});

describe('asking what is seen', () => {
  it('hands each answer to who asked, and none after a while', async () => {
    const time = new FakeTime();
    const asked: number[] = [];
    const picks = new Picks((id) => asked.push(id), time);
    const ray = { origin: [1, 0, 0], direction: [0, 0, 1] } as const;
    const [first, second, third] = [picks.at(ray), picks.at(ray), picks.at(ray)];
    const [nothing, unanswered] = [picks.distance(ray), picks.distance(ray)];
    picks.answered(asked[1]!, { distance: 4, spread: 0.1 });
    picks.answered(asked[0]!, undefined);
    picks.answered(asked[3]!, undefined);
    picks.answered(99, { distance: 1, spread: 0 });
    expect(await second).toEqual([1, 0, 4]);
    expect(await first).toBeUndefined();
    time.advance(2000);
    expect(await third).toBeUndefined();
    expect(await nothing).toBe(Infinity);
    expect(await unanswered).toBeUndefined();
  });
});
