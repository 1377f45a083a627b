import { camera_modes } from '../camera/mode';
import { by_id } from '../page/dom';
import { texts_for } from '../text/translations';
import type { SceneAbout, SceneWords } from '../tour/draft';

export const no_scene_words: SceneWords = { title: '', credits: '' };

/** The fields for what visitors are told of the scene. */
export class AuthorAbout {
  private readonly lines_ = (['title', 'credits', 'licence'] as const).map(
    (name) => [name, by_id(`about-${name}`, HTMLInputElement)] as const,
  );
  private readonly mode_ = by_id('about-mode', HTMLSelectElement);
  private readonly background_ = by_id('about-background', HTMLInputElement);

  /** `changed` hears the field, too. */
  constructor(changed: (change: Partial<SceneAbout>, field: string) => void) {
    for (const [name, line] of this.lines_) {
      line.addEventListener('input', () => changed({ [name]: line.value }, name));
    }
    this.mode_.addEventListener('change', () => {
      changed({ mode: camera_modes.find((mode) => mode === this.mode_.value) }, 'mode');
    });
    this.background_.addEventListener('input', () =>
      changed({ background: this.background_.value }, 'background'),
    );
  }

  /** Shows the texts for one language; '' for those that all others get. */
  show(about: SceneAbout, language: string): void {
    const words = { ...about, ...texts_for<SceneWords>(about, language, no_scene_words) };
    for (const [name, line] of this.lines_) {
      line.value = words[name];
      line.placeholder = language ? about[name] : '';
      line.lang = name === 'licence' ? '' : language;
    }
    this.mode_.value = about.mode ?? '';
    this.background_.value = about.background;
  }
}
