// Image files through OpenImageIO, which no other file includes.
//
// Foreign files are read into memory whole (a file truncated meanwhile cannot raise SIGBUS), their
// format is told by their first bytes, so that only the readers named below ever see them, and their
// claims are checked against limits before anything is allocated for the pixels.
#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>
#include <fcntl.h>
#include <half.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <limits>
#include <memory>
#include <new>
#include <optional>
#include <string_view>
#include <system_error>

#include "core/error.h"
#include "core/image.h"
#include "core/staged_file.h"

namespace brume {
namespace {

constexpr float kHalfMax = 65504;
constexpr int kMaxChannels = 1024;
constexpr std::uint64_t kMaxFileBytes = std::uint64_t(1) << 33;
// A picture of `max_pixels` may have this many channels, a smaller one more.
constexpr std::uint64_t kChannelsAtMaxPixels = 16;
// Deflate reaches 1,030 to 1, EXR's PIZ and DWA more on a constant image; beyond this it is a bomb.
constexpr std::uint64_t kMaxExpansion = 1 << 15;
constexpr std::uint64_t kExpansionFree = 1 << 20;
constexpr int kBandRows = 64;

[[noreturn]] void refuse(const std::filesystem::path& file, const std::string& what) {
  throw Error(ErrorKind::InvalidInput, printable(file.string()) + ": " + what);
}

// A library's message in one line of bounded length.
std::string one_line(std::string text) {
  const std::size_t end = text.find_last_not_of(" \n\r\t");
  text.resize(end == std::string::npos ? 0 : end + 1);
  std::replace(text.begin(), text.end(), '\n', ';');
  return text.empty() ? "unknown reason" : printable(text, 160);
}

void set_up_library() {
  static const bool done = [] {
    OIIO::attribute("debug", 0);  // Debian's build chats on standard error otherwise.
    OIIO::attribute("limits:channels", kMaxChannels);
    OIIO::attribute("limits:imagesize_MB", 16384);
    return true;
  }();
  (void)done;
}

// ---- writing -------------------------------------------------------------------------------------

class StagedProxy : public OIIO::Filesystem::IOProxy {
 public:
  explicit StagedProxy(StagedFile& file) : IOProxy("", Write), file_(file) {}
  const char* proxytype() const override { return "staged"; }
  std::int64_t tell() override { return file_.tell(); }
  bool seek(std::int64_t offset) override { return file_.seek(offset); }
  std::size_t write(const void* data, std::size_t bytes) override {
    if (!file_.write(data, bytes)) return 0;
    size_ = std::max(size_, file_.tell());
    return bytes;
  }
  std::size_t pwrite(const void* data, std::size_t bytes, std::int64_t offset) override {
    const std::int64_t here = tell();
    const std::size_t n = seek(offset) ? write(data, bytes) : 0;
    seek(here);
    return n;
  }
  std::size_t size() const override { return static_cast<std::size_t>(size_); }

 private:
  StagedFile& file_;
  std::int64_t size_ = 0;
};

// Opens, lets `write_pixels` fill, and puts in place. A refusal by the library that is not the disk's
// (StagedFile::commit names those) is our own mistake.
template <typename WritePixels>
void write_staged(const std::filesystem::path& file, const char* format, const OIIO::ImageSpec& spec,
                  WritePixels write_pixels) {
  set_up_library();
  StagedFile staged(file);
  StagedProxy proxy(staged);
  const std::unique_ptr<OIIO::ImageOutput> out = OIIO::ImageOutput::create(format);
  if (!out)
    throw Error(ErrorKind::Internal, "OpenImageIO has no writer for " + std::string(format) + ": " +
                                         one_line(OIIO::geterror()));
  const bool opened = out->set_ioproxy(&proxy) && out->open(file.string(), spec);
  bool complete = opened && write_pixels(*out);
  if (opened) complete = out->close() && complete;
  const std::string reason = out->geterror();
  if (complete) return staged.commit();
  if (!staged.has_failed())
    throw Error(ErrorKind::Internal, printable(file.string()) + ": " + one_line(reason));
  staged.commit();  // Throws what the disk said.
}

void check_writable(const std::filesystem::path& file, const Image& image) {
  const std::size_t pixels = std::size_t(image.width) * std::size_t(image.height);
  if (image.width < 1 || image.height < 1 || image.channels.empty())
    throw Error(ErrorKind::Internal, printable(file.string()) + ": an image without pixels");
  for (const ImageChannel& c : image.channels) {
    BRUME_ASSERT(c.values.size(), ==, pixels);
    const auto bad = std::find_if_not(c.values.begin(), c.values.end(),
                                      [](float v) { return std::isfinite(v); });
    if (bad == c.values.end()) continue;
    const auto i = static_cast<std::size_t>(bad - c.values.begin());
    throw Error(ErrorKind::Internal, printable(file.string()) + ": channel " + c.name + ": " +
                                         std::to_string(*bad) + " at pixel (" +
                                         std::to_string(i % image.width) + ", " +
                                         std::to_string(i / image.width) + ") must not be written");
  }
}

std::array<float, 16> transposed(const std::array<float, 16>& m) {
  std::array<float, 16> t{};
  for (int i = 0; i < 4; ++i)
    for (int j = 0; j < 4; ++j) t[4 * j + i] = m[4 * i + j];
  return t;
}

void add_metadata(OIIO::ImageSpec& spec, const ImageMetadata& metadata) {
  for (const auto& [name, value] : metadata) {
    if (const auto* text = std::get_if<std::string>(&value)) {
      spec.attribute(name, *text);
    } else if (const auto* real = std::get_if<double>(&value)) {
      spec.attribute(name, OIIO::TypeDesc::DOUBLE, real);
    } else if (const auto* whole = std::get_if<std::int64_t>(&value)) {
      if (*whole >= std::numeric_limits<int>::min() && *whole <= std::numeric_limits<int>::max())
        spec.attribute(name, static_cast<int>(*whole));
      else
        spec.attribute(name, std::to_string(*whole));
    } else {
      const std::array<float, 16> m = transposed(std::get<std::array<float, 16>>(value));
      spec.attribute(name, OIIO::TypeMatrix44, m.data());
    }
  }
}

// OpenImageIO stamps the time of day on every EXR without a DateTime. It drops one of the wrong type,
// and then writes none.
void keep_clock_out(OIIO::ImageSpec& spec) {
  if (!spec.find_attribute("DateTime")) spec.attribute("DateTime", 0);
}

// ---- reading -------------------------------------------------------------------------------------

class Descriptor {
 public:
  explicit Descriptor(int fd) : fd_(fd) {}
  ~Descriptor() {
    if (fd_ >= 0) close(fd_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  int get() const { return fd_; }

 private:
  int fd_;
};

std::vector<unsigned char> read_bytes(const std::filesystem::path& file) {
  // Not blocking, so that opening a FIFO does not wait for a writer that never comes.
  const Descriptor fd(open(file.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC));
  struct stat info {};
  if (fd.get() < 0 || fstat(fd.get(), &info) != 0)
    refuse(file, "cannot be opened: " + std::generic_category().message(errno));
  if (!S_ISREG(info.st_mode)) refuse(file, "not a regular file");
  const auto size = static_cast<std::uint64_t>(info.st_size);
  if (size > kMaxFileBytes)
    refuse(file, "larger than an image file may be (" + std::to_string(kMaxFileBytes >> 20) + " MB)");
  std::vector<unsigned char> bytes(size);
  std::size_t got = 0;
  while (got < bytes.size()) {
    const ssize_t n = read(fd.get(), bytes.data() + got, bytes.size() - got);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) refuse(file, "cannot be read: " + std::generic_category().message(errno));
    if (n == 0) break;
    got += static_cast<std::size_t>(n);
  }
  bytes.resize(got);
  return bytes;
}

// OpenImageIO's name of the format, or null.
const char* format_of(const std::vector<unsigned char>& bytes) {
  const std::string_view head(reinterpret_cast<const char*>(bytes.data()),
                              std::min<std::size_t>(bytes.size(), 16));
  using namespace std::string_view_literals;
  if (head.starts_with("\x76\x2f\x31\x01"sv)) return "openexr";
  if (head.starts_with("\x89PNG\r\n\x1a\n"sv)) return "png";
  if (head.starts_with("#?RADIANCE"sv) || head.starts_with("#?RGBE"sv)) return "hdr";
  if (head.starts_with("PF\n"sv) || head.starts_with("Pf\n"sv)) return "pnm";
  if (head.starts_with("II*\0"sv) || head.starts_with("MM\0*"sv)) return "tiff";
  return nullptr;
}

void check_size(const std::filesystem::path& file, std::int64_t width, std::int64_t height,
                std::int64_t channels, std::uint64_t file_bytes, std::size_t max_pixels) {
  if (width < 1 || height < 1 || channels < 1) refuse(file, "it has no pixels");
  const std::string size = std::to_string(width) + "x" + std::to_string(height);
  constexpr std::int64_t kMaxSide = 1 << 24;
  if (width > kMaxSide || height > kMaxSide || std::uint64_t(width) * std::uint64_t(height) > max_pixels)
    refuse(file, size + " pixels are over the limit of " + std::to_string(max_pixels));
  const std::uint64_t values = std::uint64_t(width) * height * channels;
  if (channels > kMaxChannels || values / kChannelsAtMaxPixels > max_pixels)
    refuse(file, std::to_string(channels) + " channels of " + size + " are over the limit");
  if (values > kExpansionFree && values / kMaxExpansion > file_bytes)
    refuse(file, size + " pixels cannot come from a file of " + std::to_string(file_bytes) + " bytes");
}

// The part of an EXR header that decides how much memory its reader takes, parsed before that reader
// sees it: OpenEXR sizes its tables by the data window alone.
//   header = magic (4) version (4) {name\0 type\0 size (4) value (size)}* \0
class ExrHeaderCheck {
 public:
  ExrHeaderCheck(const std::filesystem::path& file, const std::vector<unsigned char>& bytes)
      : file_(file), bytes_(bytes) {}

  void run(std::size_t max_pixels) {
    at_ = 4;
    const std::uint32_t version = word();
    if ((version & 0xff) != 2) refuse(file_, "damaged: not EXR version 2");
    if (version & 0x800) refuse(file_, "deep EXR images are not supported: flatten it");
    if (version & 0x1000) refuse(file_, "multi-part EXR images are not supported: save one part");
    std::optional<std::array<std::int32_t, 4>> data, display;
    std::int64_t channels = 0;
    for (std::string name = text(); !name.empty(); name = text()) {
      const std::string type = text();
      const std::uint32_t size = word();
      if (size > bytes_.size() - at_) damaged();
      const std::size_t end = at_ + size;
      if (type == "box2i" && size == 16) {
        std::array<std::int32_t, 4> box{};
        for (std::int32_t& v : box) v = static_cast<std::int32_t>(word());
        if (name == "dataWindow") data = box;
        if (name == "displayWindow") display = box;
      } else if (name == "channels" && type == "chlist") {
        channels = count_channels(end);
      } else if (name == "tiles") {
        check_tiles(size);
      }
      at_ = end;
    }
    if (!data || !display || channels == 0) damaged();
    for (const auto& box : {*data, *display})
      check_size(file_, std::int64_t(box[2]) - box[0] + 1, std::int64_t(box[3]) - box[1] + 1, channels,
                 bytes_.size(), max_pixels);
  }

 private:
  [[noreturn]] void damaged() const { refuse(file_, "damaged: its header is not that of an EXR file"); }

  std::uint32_t word() {
    if (bytes_.size() - at_ < 4) damaged();
    std::uint32_t w = 0;
    std::memcpy(&w, bytes_.data() + at_, 4);
    at_ += 4;
    return w;
  }
  std::string text() {
    const auto begin = bytes_.begin() + static_cast<std::ptrdiff_t>(at_);
    const auto limit = begin + static_cast<std::ptrdiff_t>(std::min<std::size_t>(256, bytes_.size() - at_));
    const auto end = std::find(begin, limit, 0);
    if (end == limit) damaged();
    at_ += static_cast<std::size_t>(end - begin) + 1;
    return {begin, end};
  }
  // {name\0 pixel type (4) linear (4) x sampling (4) y sampling (4)}* \0
  std::int64_t count_channels(std::size_t end) {
    std::int64_t n = 0;
    for (std::string name = text(); !name.empty(); name = text(), ++n) {
      word(), word();
      const std::uint32_t x = word(), y = word();
      if (x != 1 || y != 1) refuse(file_, "subsampled EXR channels are not supported: save as RGB");
      if (at_ > end) damaged();
    }
    return n;
  }
  // Width and height of a tile: its buffers are sized by them, not by the image.
  void check_tiles(std::uint32_t size) {
    if (size != 9) damaged();
    const std::uint32_t x = word(), y = word();
    constexpr std::uint32_t kMaxTile = 1 << 13;
    if (x < 1 || y < 1 || x > kMaxTile || y > kMaxTile)
      refuse(file_, "EXR tiles of " + std::to_string(x) + "x" + std::to_string(y) + " are over the limit");
  }

  const std::filesystem::path& file_;
  const std::vector<unsigned char>& bytes_;
  std::size_t at_ = 0;
};

// PNG chunks are {length (4) name (4) data checksum (4)}*, big-endian, IHDR first and IEND last. Checked
// here because libpng says what it finds on standard error.
void check_png(const std::filesystem::path& file, const std::vector<unsigned char>& bytes,
               std::size_t max_pixels) {
  static const std::array<std::uint32_t, 256> table = [] {
    std::array<std::uint32_t, 256> t{};
    for (std::uint32_t i = 0; i < 256; ++i) {
      std::uint32_t c = i;
      for (int k = 0; k < 8; ++k) c = c & 1 ? 0xedb88320u ^ c >> 1 : c >> 1;
      t[i] = c;
    }
    return t;
  }();
  const auto word = [&](std::size_t at) {
    return std::uint32_t(bytes[at]) << 24 | std::uint32_t(bytes[at + 1]) << 16 |
           std::uint32_t(bytes[at + 2]) << 8 | std::uint32_t(bytes[at + 3]);
  };
  std::string_view name;
  for (std::size_t at = 8; name != "IEND";) {
    if (bytes.size() - at < 12 || word(at) > bytes.size() - at - 12)
      refuse(file, "damaged: this PNG file is cut off");
    const std::size_t length = word(at);
    const bool is_first = name.empty();
    name = {reinterpret_cast<const char*>(bytes.data()) + at + 4, 4};
    std::uint32_t checksum = 0xffffffffu;
    for (std::size_t i = at + 4; i < at + 8 + length; ++i)
      checksum = table[(checksum ^ bytes[i]) & 0xff] ^ checksum >> 8;
    if (~checksum != word(at + 8 + length)) refuse(file, "damaged: a PNG checksum is wrong");
    if (is_first) {
      if (name != "IHDR" || length != 13) refuse(file, "damaged: not the header of a PNG file");
      check_size(file, word(at + 8), word(at + 12), 4, bytes.size(), max_pixels);
    }
    at += 12 + length;
  }
}

ImageMetadata metadata_of(const OIIO::ImageSpec& spec) {
  ImageMetadata metadata;
  for (const OIIO::ParamValue& p : spec.extra_attribs) {
    const std::string name = p.name().string();
    if (p.type() == OIIO::TypeString) {
      metadata[name] = p.get_string();
    } else if (p.type() == OIIO::TypeInt) {
      metadata[name] = static_cast<std::int64_t>(p.get_int());
    } else if (p.type() == OIIO::TypeFloat) {
      metadata[name] = static_cast<double>(p.get_float());
    } else if (p.type() == OIIO::TypeDesc(OIIO::TypeDesc::DOUBLE)) {
      metadata[name] = *static_cast<const double*>(p.data());
    } else if (p.type() == OIIO::TypeMatrix44) {
      std::array<float, 16> m{};
      std::memcpy(m.data(), p.data(), sizeof m);
      metadata[name] = transposed(m);
    }
  }
  return metadata;
}

// Rows [y, y + rows) of the data window, interleaved.
bool read_rows(OIIO::ImageInput& in, const OIIO::ImageSpec& spec, int y, int rows,
               std::vector<float>& band) {
  band.resize(std::size_t(spec.width) * rows * spec.nchannels);
  if (spec.tile_width == 0)
    return in.read_scanlines(0, 0, spec.y + y, spec.y + y + rows, 0, 0, spec.nchannels, OIIO::TypeFloat,
                             band.data());
  return in.read_tiles(0, 0, spec.x, spec.x + spec.width, spec.y + y, spec.y + y + rows, 0, 1, 0,
                       spec.nchannels, OIIO::TypeFloat, band.data());
}

// Stored sRGB becomes linear, then associated with alpha: OpenImageIO would multiply by alpha first.
void linearise(Image& image, bool multiply_alpha) {
  const ImageChannel* alpha = image.find("A");
  for (ImageChannel& c : image.channels) {
    if (c.name == "A") continue;
    for (std::size_t i = 0; i < c.values.size(); ++i) {
      c.values[i] = static_cast<float>(srgb_decoded(c.values[i]));
      if (alpha && multiply_alpha) c.values[i] *= alpha->values[i];
    }
  }
}

// Formats without channel names: one channel is grey, two are grey and alpha.
void name_colours(Image& image) {
  auto& channels = image.channels;
  if (channels.size() <= 2) {
    ImageChannel grey = channels[0];
    grey.name = "B";
    channels.insert(channels.begin() + 1, grey);
    grey.name = "G";
    channels.insert(channels.begin() + 1, std::move(grey));
  }
  const char* names[] = {"R", "G", "B", "A"};
  for (std::size_t i = 0; i < std::min<std::size_t>(4, channels.size()); ++i)
    channels[i].name = names[i];
}

ImageFile decode(const std::filesystem::path& file, const char* format,
                 const std::vector<unsigned char>& bytes, std::size_t max_pixels) {
  OIIO::Filesystem::IOMemReader proxy(bytes.data(), bytes.size());
  const std::unique_ptr<OIIO::ImageInput> in = OIIO::ImageInput::create(format);
  if (!in)
    throw Error(ErrorKind::Internal, "OpenImageIO has no reader for " + std::string(format) + ": " +
                                         one_line(OIIO::geterror()));
  OIIO::ImageSpec config, spec;
  config.attribute("oiio:UnassociatedAlpha", 1);
  const bool from_memory = in->supports("ioproxy") && in->set_ioproxy(&proxy);
  if (!from_memory)
    throw Error(ErrorKind::Internal, "OpenImageIO reads " + std::string(format) + " from disk only");
  if (!in->open(file.string(), spec, config)) refuse(file, "cannot be read: " + one_line(in->geterror()));

  if (spec.deep || spec.depth > 1) refuse(file, "not a flat image");
  if (spec.get_int_attribute("Orientation", 1) != 1)
    refuse(file, "it is stored turned or mirrored: save it upright");
  check_size(file, spec.width, spec.height, spec.nchannels, bytes.size(), max_pixels);
  const bool is_exr = std::string_view(format) == "openexr";
  const int full_width = is_exr ? spec.full_width : spec.width;
  const int full_height = is_exr ? spec.full_height : spec.height;
  check_size(file, full_width, full_height, spec.nchannels, bytes.size(), max_pixels);

  ImageFile result;
  Image& image = result.image;
  image.width = full_width;
  image.height = full_height;
  image.channels.resize(static_cast<std::size_t>(spec.nchannels));
  for (int c = 0; c < spec.nchannels; ++c) {
    ImageChannel& channel = image.channels[c];
    channel.name = spec.channel_name(c);
    channel.is_half = spec.channelformat(c) == OIIO::TypeHalf;
    channel.values.assign(std::size_t(full_width) * full_height, 0.0f);
  }
  const int left = is_exr ? spec.x - spec.full_x : 0, top = is_exr ? spec.y - spec.full_y : 0;
  // Whole rows of tiles, where there are tiles.
  const int step = spec.tile_width == 0 ? kBandRows : spec.tile_height;
  std::vector<float> band;
  for (int y = 0; y < spec.height; y += step) {
    const int rows = std::min(step, spec.height - y);
    if (!read_rows(*in, spec, y, rows, band)) refuse(file, "damaged: " + one_line(in->geterror()));
    for (int row = std::max(0, -(top + y)); row < rows && top + y + row < full_height; ++row)
      for (int x = std::max(0, -left); x < spec.width && left + x < full_width; ++x)
        for (int c = 0; c < spec.nchannels; ++c)
          image.channels[c].values[std::size_t(top + y + row) * full_width + left + x] =
              band[(std::size_t(row) * spec.width + x) * spec.nchannels + c];
  }
  if (!is_exr) name_colours(image);
  if (spec.format.is_floating_point() == false)
    linearise(image, spec.get_int_attribute("oiio:UnassociatedAlpha", 0) != 0);
  result.metadata = metadata_of(spec);
  return result;
}

}  // namespace

std::size_t write_exr(const std::filesystem::path& file, const Image& image,
                      const ImageMetadata& metadata) {
  check_writable(file, image);
  OIIO::ImageSpec spec(image.width, image.height, static_cast<int>(image.channels.size()),
                       OIIO::TypeHalf);
  spec.channelnames.clear();
  for (const ImageChannel& c : image.channels) {
    spec.channelnames.push_back(c.name);
    spec.channelformats.push_back(c.is_half ? OIIO::TypeHalf : OIIO::TypeFloat);
  }
  add_metadata(spec, metadata);
  keep_clock_out(spec);
  spec.attribute("compression", "zip");
  constexpr float rec709[8] = {0.64f, 0.33f, 0.30f, 0.60f, 0.15f, 0.06f, 0.3127f, 0.3290f};
  spec.attribute("chromaticities", OIIO::TypeDesc(OIIO::TypeDesc::FLOAT, 8), rec709);

  // Converted here rather than in the library, so that rounding and clamping are known and counted.
  std::size_t clamped = 0;
  std::vector<unsigned char> band;
  write_staged(file, "openexr", spec, [&](OIIO::ImageOutput& out) {
    for (int y = 0; y < image.height; y += kBandRows) {
      const int rows = std::min(kBandRows, image.height - y);
      band.resize(spec.pixel_bytes(true) * image.width * rows);
      unsigned char* to = band.data();
      const std::size_t begin = std::size_t(y) * image.width, end = begin + std::size_t(rows) * image.width;
      for (std::size_t i = begin; i < end; ++i)
        for (const ImageChannel& c : image.channels) {
          if (c.is_half) {
            clamped += std::abs(c.values[i]) > kHalfMax;
            const Imath::half h(std::clamp(c.values[i], -kHalfMax, kHalfMax));
            const std::uint16_t bits = h.bits();
            std::memcpy(to, &bits, sizeof bits);
            to += sizeof bits;
          } else {
            std::memcpy(to, &c.values[i], sizeof(float));
            to += sizeof(float);
          }
        }
      if (!out.write_scanlines(y, y + rows, 0, OIIO::TypeUnknown, band.data())) return false;
    }
    return true;
  });
  return clamped;
}

ImageFile read_image(const std::filesystem::path& file, std::size_t max_pixels) {
  set_up_library();
  const std::vector<unsigned char> bytes = read_bytes(file);
  const char* format = format_of(bytes);
  if (!format) refuse(file, "not an EXR, HDR, PNG, PFM or TIFF image");
  try {
    if (std::string_view(format) == "openexr") ExrHeaderCheck(file, bytes).run(max_pixels);
    if (std::string_view(format) == "png") check_png(file, bytes, max_pixels);
    return decode(file, format, bytes, max_pixels);
  } catch (const std::bad_alloc&) {
    throw Error(ErrorKind::Resource, printable(file.string()) + ": not enough memory for this image");
  }
}

void write_png(const std::filesystem::path& file, int width, int height,
               const std::vector<std::uint8_t>& srgb) {
  BRUME_ASSERT(srgb.size(), ==, std::size_t(3) * width * height);
  OIIO::ImageSpec spec(width, height, 3, OIIO::TypeUInt8);
  spec.attribute("oiio:ColorSpace", "sRGB");
  write_staged(file, "png", spec, [&](OIIO::ImageOutput& out) {
    return out.write_image(OIIO::TypeUInt8, srgb.data());
  });
}

}  // namespace brume
