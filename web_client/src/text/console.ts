// Texts for the console of the browser, in English. The page loads them when it has one to say.
import { catalogue } from './generated/console';
import { messages } from './messages';

export const console_texts = messages(catalogue, 'en', 'en');
