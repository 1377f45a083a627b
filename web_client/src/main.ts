import { browser_storage } from './base/browser_storage';
import { is_own_error } from './base/own_errors';
import { leaves_scene_open, list_scenes } from './session/scenes';
import { AccessToken } from './session/token';
import { translate_page } from './text/page';
import { CardView } from './ui/card';
import { show_gallery } from './ui/gallery';
import { broken_card, unsupported_card } from './ui/wording';
import { mount_viewer } from './viewer';

const own_folder = import.meta.url.replace(/[^/]*$/, '');

async function main(): Promise<void> {
  translate_page();
  const card = new CardView();
  let failed = (message: string): void => card.show(broken_card(message));
  window.addEventListener('error', (event) => {
    if (is_own_error(event, own_folder)) failed(event.message);
  });
  window.addEventListener('unhandledrejection', (event) => {
    if (is_own_error(event, own_folder)) failed(String(event.reason));
  });

  const unsupported = unsupported_card(globalThis);
  if (unsupported) return card.show(unsupported);
  const token = new AccessToken(location, history, browser_storage('sessionStorage'));
  const query = new URLSearchParams(location.search);
  const requested = query.get('scene') ?? '';
  const scenes = requested ? [] : await list_scenes(location.href, token.value);
  if (scenes.length > 1 && leaves_scene_open(location.href))
    return show_gallery(scenes, token.value);
  failed = mount_viewer(card, token, requested || (scenes[0]?.id ?? ''), query.has('author'));
}

void main();
