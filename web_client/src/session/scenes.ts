import { ask_server, scene_path } from '../base/server';
import { readers } from '../text/text';
import { in_language, type Translations } from '../text/translations';
import type { SceneFacts } from '../wire/wire';

/** A scene that this visitor may see, as GET /api/scenes tells of it. */
export interface SceneListing {
  readonly id: string;
  readonly title: string;
  readonly credits: string;
  readonly licence: string;
}

type ListedScene = SceneListing & { readonly translations?: Readonly<Record<string, object>> };

/** The texts about a scene, and those in other languages. */
export const scene_words = ({
  title,
  credits,
  translations,
}: SceneFacts): {
  readonly title: string;
  readonly credits: string;
  readonly translations: Translations<{ readonly title: string; readonly credits: string }>;
} => ({
  title,
  credits,
  translations: new Map(translations.map(({ language, ...words }) => [language, words])),
});

/** The scenes that this token may see; empty when the server does not answer. */
export async function list_scenes(
  page_url: string,
  token: string,
): Promise<readonly SceneListing[]> {
  try {
    const response = await ask_server(page_url, token, 'scenes', {
      signal: AbortSignal.timeout(5000),
    });
    if (!response.ok) return [];
    const { scenes } = (await response.json()) as { scenes: readonly ListedScene[] };
    return scenes.map(({ translations, ...scene }) =>
      in_language({ ...scene, translations: new Map(Object.entries(translations ?? {})) }, readers),
    );
  } catch (error) {
    console.warn('the list of scenes could not be read', error);
    return [];
  }
}

const first_try_ms = 1000; // the server may have kept it
const next_try_ms = 5000;
const tries = 60; // five minutes: a scene that is not loaded by then has more important visitors before it

/** A still of the scene; 'later': the server has none yet; undefined: there will be none. */
async function fetch_poster(
  page_url: string,
  token: string,
  scene_id: string,
): Promise<Blob | 'later' | undefined> {
  try {
    const response = await ask_server(page_url, token, scene_path(scene_id, 'poster.jpg'));
    if (response.status !== 200) return response.headers.has('retry-after') ? 'later' : undefined;
    const blob = await response.blob();
    return blob.type.startsWith('image/') ? blob : undefined;
  } catch (error) {
    console.warn('no poster could be shown', error);
    return undefined;
  }
}

/** Asks until the poster is there. Undefined: there is none, or `is_over` says that nobody needs it any more. */
export async function await_poster(
  page_url: string,
  token: string,
  scene_id: string,
  is_over: () => boolean = () => false,
): Promise<Blob | undefined> {
  for (let i = 0; i < tries && !is_over(); ++i) {
    const poster = await fetch_poster(page_url, token, scene_id);
    if (poster !== 'later') return is_over() ? undefined : poster;
    await new Promise((resolve) => setTimeout(resolve, i === 0 ? first_try_ms : next_try_ms));
  }
  return undefined;
}

/** What people call the scene: its id ("hall-kdfmqrtv") without the digest of its path. */
export function scene_name(scene_id: string): string {
  return scene_id.replace(/^(.+)-[b-df-hjkmnp-tv]{8}$/, '$1');
}

/** Name for files of the scene, without extension. */
export const file_name_of = (scene_id: string): string => scene_name(scene_id) || 'scene';

/** Whom a scene is from, and under which licence; '' where nothing is said. */
export const credit_line = ({
  credits,
  licence,
}: Pick<SceneListing, 'credits' | 'licence'>): string =>
  [credits, licence].filter((words) => words).join(' · ');

/** Titles for a list of scenes, and ids where several have the same title. */
export function scene_labels(scenes: readonly SceneListing[]): readonly string[] {
  const titles = scenes.map(({ title }) => title);
  const seen = new Set<string>();
  const shared = new Set(titles.filter((title) => seen.size === seen.add(title).size));
  return scenes.map(({ id, title }) => (shared.has(title) ? id : title));
}

/** The page's address with this scene, or with no scene where `scene_id` is empty. The view is left out. */
export function scene_address(page_url: string, scene_id = ''): string {
  const url = new URL(page_url);
  if (scene_id) url.searchParams.set('scene', scene_id);
  else url.searchParams.delete('scene');
  url.hash = '';
  return url.href;
}

/** Whether the address leaves the scene open: it names none, and shows no view of one. Frames get the first scene. */
export function leaves_scene_open(page_url: string): boolean {
  const { searchParams, hash } = new URL(page_url);
  return (
    !searchParams.get('scene') &&
    searchParams.get('ui') !== '0' &&
    !/[#&](at|stop|watch)=/.test(hash)
  );
}
