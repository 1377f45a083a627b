// Pages of authors load this besides: the editor, and its fields for media.
export { TourEditor } from './author/tour_editor';
export { AuthorMedia } from './media/author_media';
