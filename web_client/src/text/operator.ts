// Texts for those who run a server. They are English in every language of the page.
import { catalogue } from './generated/operator';
import { messages } from './messages';
import { locale } from './text';

export const operator = messages(catalogue, 'en', locale);
