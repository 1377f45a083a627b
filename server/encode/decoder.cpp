#include "server/encode/decoder.h"

#include <algorithm>
#include <string>

#include "render_core/base/error.h"
#include "server/encode/libav.h"

namespace catgs {

struct Decoder::State {
  const char* name = nullptr;
  libav::CodecContext context;
  libav::Frame output = libav::make_frame();
  libav::Packet packet = libav::make_packet();
};

namespace {

void copy_plane(const AVFrame& frame, int plane, glm::ivec2 size_px,
                std::vector<std::uint8_t>& out) {
  out.resize(static_cast<std::size_t>(size_px.x) * static_cast<std::size_t>(size_px.y));
  const std::uint8_t* row = frame.data[plane];
  for (auto to = out.begin(); to != out.end(); to += size_px.x) {
    std::copy_n(row, size_px.x, to);
    row += frame.linesize[plane];
  }
}

// FFmpeg 6.1 (Ubuntu 24.04) made the field a flag and deprecated it.
bool is_key_frame(const AVFrame& frame) {
#ifdef AV_FRAME_FLAG_KEY
  return (frame.flags & AV_FRAME_FLAG_KEY) != 0;
#else
  return frame.key_frame != 0;
#endif
}

}  // namespace

Decoder::Decoder(Codec codec) : state_(std::make_unique<State>()) {
  state_->name = codec == Codec::h264 ? "h264" : "mjpeg";
  const AVCodec* decoder = avcodec_find_decoder_by_name(state_->name);
  if (decoder == nullptr) throw InputError(state_->name, "", "libavcodec has no such decoder");
  state_->context = libav::make_context(*decoder);
  state_->context->thread_count = 1;  // frame threads would hold pictures back
  // Concealment stays on, because without it libavcodec 59 rejects every picture of several slices.
  // It reports what it conceals, and such a picture is refused.
  state_->context->err_recognition = AV_EF_CRCCHECK | AV_EF_BITSTREAM | AV_EF_EXPLODE;
  libav::Options options;
  libav::open(*state_->context, *decoder, options);
}

Decoder::~Decoder() = default;

EncodeStatus Decoder::decode(std::span<const std::byte> bytes, DecodedPicture& picture) {
  const libav::LogCapture log;
  AVPacket& packet = *state_->packet;
  // The copy in a packet of libav's own carries the zero padding that its bit readers need.
  int result = av_new_packet(&packet, static_cast<int>(bytes.size()));
  if (result >= 0) {
    std::copy(bytes.begin(), bytes.end(), reinterpret_cast<std::byte*>(packet.data));
    result = avcodec_send_packet(state_->context.get(), &packet);
    av_packet_unref(&packet);
  }
  AVFrame& frame = *state_->output;
  if (result >= 0) result = avcodec_receive_frame(state_->context.get(), &frame);
  if (result < 0) return {false, std::string(state_->name) + ": " + log.explain(result)};
  if (frame.decode_error_flags != 0) {
    return {false, std::string(state_->name) + ": damaged picture: " + log.explain(result)};
  }
  if (frame.format != AV_PIX_FMT_YUV420P && frame.format != AV_PIX_FMT_YUVJ420P) {
    return {false, std::string(state_->name) + ": the picture is not 8-bit 4:2:0"};
  }
  picture.size_px = {frame.width, frame.height};
  picture.full_range = frame.format == AV_PIX_FMT_YUVJ420P || frame.color_range == AVCOL_RANGE_JPEG;
  picture.idr = is_key_frame(frame);
  const glm::ivec2 chroma_px = (picture.size_px + 1) / 2;
  copy_plane(frame, 0, picture.size_px, picture.planes[0]);
  copy_plane(frame, 1, chroma_px, picture.planes[1]);
  copy_plane(frame, 2, chroma_px, picture.planes[2]);
  av_frame_unref(&frame);
  return {};
}

}  // namespace catgs
