#include "core/image.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <csignal>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "core/error.h"
#include "core/random.h"
#include "core/staged_file.h"

namespace brume {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using namespace std::string_literals;

std::string bytes_of(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

void put_bytes(const fs::path& file, const std::string& bytes) {
  std::ofstream(file, std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
}

class ImageFileTest : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::path(testing::TempDir()) /
              ("brume_image_" + std::to_string(getpid()) + "_" +
               testing::UnitTest::GetInstance()->current_test_info()->name());
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }
  fs::path path(const std::string& name) const { return folder_ / name; }
  std::size_t files_in_folder() const {
    return static_cast<std::size_t>(std::distance(fs::directory_iterator(folder_), {}));
  }
  // The kind and message with which read_image() refuses `file`; a failure when it does not.
  std::string refusal(const fs::path& file, std::size_t max_pixels = std::size_t(1) << 28) const {
    try {
      read_image(file, max_pixels);
    } catch (const Error& e) {
      EXPECT_EQ(e.kind(), ErrorKind::InvalidInput) << e.what();
      EXPECT_EQ(std::string(e.what()).find('\n'), std::string::npos) << e.what();
      return e.what();
    }
    ADD_FAILURE() << file << " was read";
    return "";
  }

  fs::path folder_;
};

// Half colours with a known pattern, and a float layer.
Image small_image(int width = 19, int height = 7) {
  Image image;
  image.width = width;
  image.height = height;
  for (const char* name : {"Z", "diffuse_direct.R", "A", "B", "G", "R", "N.X", "N.Y", "N.Z"}) {
    ImageChannel c;
    c.name = name;
    c.is_half = c.name != "Z" && c.name[0] != 'N';
    for (int i = 0; i < width * height; ++i)
      c.values.push_back(static_cast<float>((i % 64) * 0.25 + static_cast<int>(image.channels.size())));
    image.channels.push_back(std::move(c));
  }
  return image;
}

TEST_F(ImageFileTest, ExrKeepsEveryChannelAndItsType) {
  const Image image = small_image();
  EXPECT_EQ(write_exr(path("a.exr"), image, {}), 0u);
  const Image back = read_image(path("a.exr")).image;
  ASSERT_EQ(back.width, image.width);
  ASSERT_EQ(back.height, image.height);
  ASSERT_EQ(back.channels.size(), image.channels.size());
  for (const ImageChannel& c : image.channels) {
    const ImageChannel* b = back.find(c.name);
    ASSERT_NE(b, nullptr) << c.name;
    EXPECT_EQ(b->is_half, c.is_half) << c.name;
    EXPECT_EQ(b->values, c.values) << c.name;
  }
}

TEST_F(ImageFileTest, ExrShowsColourFirst) {
  write_exr(path("a.exr"), small_image(), {});
  const Image back = read_image(path("a.exr")).image;
  EXPECT_EQ(back.channels[0].name, "R");
  EXPECT_EQ(back.channels[1].name, "G");
  EXPECT_EQ(back.channels[2].name, "B");
  EXPECT_EQ(back.channels[3].name, "A");
}

TEST_F(ImageFileTest, ExrKeepsMetadata) {
  std::array<float, 16> m{};
  for (int i = 0; i < 16; ++i) m[i] = static_cast<float>(i) + 0.5f;
  const ImageMetadata metadata{{"brume:command", std::string("brume render a.json")},
                               {"brume:seconds.bake", 1.0 / 3},
                               {"brume:seed", std::int64_t(-7)},
                               {"brume:rays", std::int64_t(1) << 40},
                               {"brume:name_longer_than_thirty_one_characters", std::string("x")},
                               {"worldToCamera", m}};
  write_exr(path("a.exr"), small_image(), metadata);
  const ImageMetadata back = read_image(path("a.exr")).metadata;
  for (const auto& [name, value] : metadata) {
    ASSERT_TRUE(back.count(name)) << name;
    if (name != "brume:rays") {
      EXPECT_TRUE(back.at(name) == value) << name;
    }
  }
  EXPECT_EQ(std::get<std::string>(back.at("brume:rays")), "1099511627776");
}

TEST_F(ImageFileTest, ExrStoresMatricesForRowVectors) {
  std::array<float, 16> m{1, 0, 0, 5, 0, 1, 0, 6, 0, 0, 1, 7, 0, 0, 0, 1};
  write_exr(path("a.exr"), small_image(), {{"worldToCamera", m}});
  // name\0 type\0 size, then 16 floats: Imath keeps the translation in the last row.
  const std::string bytes = bytes_of(path("a.exr"));
  const std::string mark = std::string("worldToCamera") + '\0' + "m44f" + '\0' + '@' + std::string(3, '\0');
  const std::size_t at = bytes.find(mark);
  ASSERT_NE(at, std::string::npos);
  float stored[16];
  std::memcpy(stored, bytes.data() + at + mark.size(), sizeof stored);
  EXPECT_EQ(stored[12], 5);
  EXPECT_EQ(stored[13], 6);
  EXPECT_EQ(stored[14], 7);
  EXPECT_EQ(stored[3], 0);
}

TEST_F(ImageFileTest, ExrStatesRec709AndZipAndNoClock) {
  write_exr(path("a.exr"), small_image(), {});
  const std::string bytes = bytes_of(path("a.exr"));
  EXPECT_THAT(bytes, HasSubstr("chromaticities"));
  EXPECT_EQ(bytes[bytes.find("compression\0compression\0"s) + 28], 3) << "3 is ZIP";
  EXPECT_EQ(bytes.find("capDate"), std::string::npos);
  EXPECT_EQ(bytes.find("DateTime"), std::string::npos);
}

TEST_F(ImageFileTest, EqualContentGivesEqualBytes) {
  const ImageMetadata metadata{{"a", 1.0}, {"b", std::string("c")}};
  write_exr(path("a.exr"), small_image(300, 200), metadata);
  write_png(path("a.png"), 2, 1, {1, 2, 3, 4, 5, 6});
  sleep(1);  // A clock in the file would show.
  write_exr(path("b.exr"), small_image(300, 200), metadata);
  write_png(path("b.png"), 2, 1, {1, 2, 3, 4, 5, 6});
  EXPECT_EQ(bytes_of(path("a.exr")), bytes_of(path("b.exr")));
  EXPECT_EQ(bytes_of(path("a.png")), bytes_of(path("b.png")));
}

TEST_F(ImageFileTest, HalvesAreRoundedToNearestAndClampedWithACount) {
  Image image;
  image.width = 5;
  image.height = 1;
  image.channels = {{"R", true, {1e6f, -1e6f, 65504, 1 + 0x1p-11f, 1 + 0x1.8p-10f}},
                    {"G", false, {1e6f, -1e6f, 1e30f, 0, 0}}};
  EXPECT_EQ(write_exr(path("a.exr"), image, {}), 2u);
  const Image back = read_image(path("a.exr")).image;
  EXPECT_THAT(back.find("R")->values,
              testing::ElementsAre(65504, -65504, 65504, 1, 1 + 0x1p-9f));
  EXPECT_EQ(back.find("G")->values, image.channels[1].values);
}

TEST_F(ImageFileTest, NonFiniteValuesAreOurOwnBug) {
  for (const float bad : {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
    Image image = small_image();
    image.channels[0].values[20] = bad;
    try {
      write_exr(path("a.exr"), image, {});
      FAIL() << bad << " was written";
    } catch (const Error& e) {
      EXPECT_EQ(e.kind(), ErrorKind::Internal);
      EXPECT_THAT(e.what(), HasSubstr("channel Z"));
      EXPECT_THAT(e.what(), HasSubstr("pixel (1, 1)"));
    }
  }
  EXPECT_EQ(files_in_folder(), 0u);
}

TEST_F(ImageFileTest, AFailedWriteNamesTheFileAndLeavesTheOldOne) {
  put_bytes(path("a.exr"), "old");
  // SIGXFSZ ignored: a file over the limit then fails like a full disk.
  signal(SIGXFSZ, SIG_IGN);
  rlimit old{};
  getrlimit(RLIMIT_FSIZE, &old);
  const rlimit small{2000, old.rlim_max};
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &small), 0);
  std::string message;
  ErrorKind kind = ErrorKind::Internal;
  Image noise = small_image(64, 64);
  RandomStream random(1);
  for (float& v : noise.channels[0].values) v = static_cast<float>(random.uniform());
  try {
    write_exr(path("a.exr"), noise, {});
  } catch (const Error& e) {
    kind = e.kind();
    message = e.what();
  }
  setrlimit(RLIMIT_FSIZE, &old);
  EXPECT_EQ(kind, ErrorKind::Resource);
  EXPECT_THAT(message, HasSubstr("a.exr"));
  EXPECT_THAT(message, HasSubstr("bytes"));
  EXPECT_EQ(bytes_of(path("a.exr")), "old");
  EXPECT_EQ(files_in_folder(), 1u) << "the staged file must be gone";
}

TEST_F(ImageFileTest, APlaceThatCannotBeWrittenIsAResourceError) {
  fs::create_directory(path("folder.exr"));
  for (const fs::path& file : {path("absent/a.exr"), path("folder.exr"), fs::path("/proc/a.exr")}) {
    try {
      write_exr(file, small_image(), {});
      FAIL() << file;
    } catch (const Error& e) {
      EXPECT_EQ(e.kind(), ErrorKind::Resource) << e.what();
      EXPECT_THAT(e.what(), HasSubstr(file.string()));
    }
  }
  EXPECT_EQ(files_in_folder(), 1u);
}

TEST_F(ImageFileTest, PngIsReadAsLinearColour) {
  write_png(path("a.png"), 3, 1, {0, 0, 0, 255, 255, 255, 188, 10, 128});
  const Image image = read_image(path("a.png")).image;
  ASSERT_EQ(image.width, 3);
  const std::vector<Rgb> colour = image.layer("");
  EXPECT_EQ(colour[0], Rgb(0.0f));
  EXPECT_NEAR(colour[1].g, 1, 1e-6);
  EXPECT_NEAR(colour[2].r, 0.5028865, 1e-5);   // ((188/255 + 0.055) / 1.055)^2.4
  EXPECT_NEAR(colour[2].g, 0.0030353, 1e-6);   // 10/255 / 12.92
  EXPECT_NEAR(colour[2].b, 0.2158605, 1e-5);
}

TEST_F(ImageFileTest, PfmAndHdrAreRead) {
  const float values[6] = {1, 2, 3, 4, 5, 6};  // PFM's first row is the bottom one.
  put_bytes(path("a.pfm"), "PF\n1 2\n-1.0\n" + std::string(reinterpret_cast<const char*>(values), 24));
  const std::vector<Rgb> pfm = read_image(path("a.pfm")).image.layer("");
  EXPECT_EQ(pfm[0], Rgb(4, 5, 6));
  EXPECT_EQ(pfm[1], Rgb(1, 2, 3));
  // One pixel, flat: mantissas and a shared exponent of 128 + 1.
  put_bytes(path("a.hdr"), std::string("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 1\n\x80\x40\x20\x81"));
  const Rgb hdr = read_image(path("a.hdr")).image.layer("")[0];
  EXPECT_NEAR(hdr.r, 1.0, 0.01);
  EXPECT_NEAR(hdr.g, 0.5, 0.01);
  EXPECT_NEAR(hdr.b, 0.25, 0.01);
}

TEST_F(ImageFileTest, WhatIsNoImageIsRefusedWithItsName) {
  put_bytes(path("empty.exr"), "");
  put_bytes(path("text.exr"), "hello, this is no image at all");
  fs::create_directory(path("folder"));
  ASSERT_EQ(mkfifo(path("fifo.exr").c_str(), 0600), 0);
  for (const char* name : {"empty.exr", "text.exr", "folder", "fifo.exr", "absent.exr"})
    EXPECT_THAT(refusal(path(name)), HasSubstr(name));
}

TEST_F(ImageFileTest, TooManyPixelsAreRefused) {
  write_exr(path("a.exr"), small_image(40, 30), {});
  EXPECT_THAT(refusal(path("a.exr"), 1199), HasSubstr("40x30"));
  EXPECT_NO_THROW(read_image(path("a.exr"), 1200));
  write_png(path("a.png"), 20, 20, std::vector<std::uint8_t>(1200));
  EXPECT_THAT(refusal(path("a.png"), 399), HasSubstr("20x20"));
}

// HARD_CASES T17: a header of a few hundred bytes that claims terabytes.
TEST_F(ImageFileTest, AHeaderThatClaimsMorePixelsThanItsFileHoldsIsRefused) {
  write_exr(path("a.exr"), small_image(), {});
  std::string bytes = bytes_of(path("a.exr"));
  const std::string mark = "dataWindow\0box2i\0\x10\0\0\0"s;
  const std::size_t at = bytes.find(mark);
  ASSERT_NE(at, std::string::npos);
  for (const std::int32_t side : {16'000, 1'000'000, std::numeric_limits<std::int32_t>::max()}) {
    std::memcpy(&bytes[at + mark.size() + 8], &side, 4);
    std::memcpy(&bytes[at + mark.size() + 12], &side, 4);
    put_bytes(path("bomb.exr"), bytes);
    refusal(path("bomb.exr"));
  }
  put_bytes(path("bomb.hdr"), "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1000000 +X 1000000\n");
  refusal(path("bomb.hdr"));
  put_bytes(path("bomb.pfm"), "PF\n1000000 1000000\n-1.0\n");
  refusal(path("bomb.pfm"));
}

// A damaged file is an image or one line of InvalidInput, never a crash.
class DamagedFileTest : public ImageFileTest {
 protected:
  void read_mutant(const std::string& name, const std::string& bytes) {
    put_bytes(path(name), bytes);
    try {
      const Image image = read_image(path(name), 1 << 20).image;
      for (const ImageChannel& c : image.channels)
        ASSERT_EQ(c.values.size(), std::size_t(image.width) * image.height);
      ++read_;
    } catch (const Error& e) {
      EXPECT_EQ(e.kind(), ErrorKind::InvalidInput) << e.what();
      EXPECT_EQ(std::string(e.what()).find('\n'), std::string::npos) << e.what();
      ++refused_;
    }
  }
  // Every truncation up to 600 bytes and some beyond, then `flips` single-bit flips.
  void damage(const std::string& name, int flips) {
    const std::string whole = bytes_of(path(name));
    ASSERT_GT(whole.size(), 64u);
    for (std::size_t n = 0; n < whole.size(); n += n < 600 ? 1 : 97)
      read_mutant("cut_" + name, whole.substr(0, n));
    EXPECT_GT(refused_, 30) << "truncations must be noticed";
    RandomStream random(17);
    for (int i = 0; i < flips; ++i) {
      std::string bytes = whole;
      // Half of them in the header, where they do most.
      const std::size_t range = i % 2 ? bytes.size() : std::min<std::size_t>(bytes.size(), 700);
      const auto bit = static_cast<std::size_t>(random.uniform() * 8 * static_cast<double>(range));
      bytes[bit / 8] = static_cast<char>(bytes[bit / 8] ^ (1 << bit % 8));
      read_mutant("flip_" + name, bytes);
    }
    EXPECT_GT(read_ + refused_, flips);
  }
  int read_ = 0, refused_ = 0;
};

TEST_F(DamagedFileTest, ExrIsReadOrRefused) {
  Image image = small_image(37, 41);
  RandomStream random(3);
  for (ImageChannel& c : image.channels)
    for (float& v : c.values) v = static_cast<float>(random.uniform());
  write_exr(path("a.exr"), image, {{"brume:text", std::string("words")}});
  damage("a.exr", 1500);
}

TEST_F(DamagedFileTest, HdrIsReadOrRefused) {
  std::string bytes = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\nEXPOSURE=1\n\n-Y 9 +X 16\n";
  RandomStream random(5);
  for (int row = 0; row < 9; ++row) {
    bytes += std::string("\x02\x02\x00\x10", 4);  // New-style run lengths, 16 wide.
    for (int component = 0; component < 4; ++component) {
      bytes += std::string("\x88", 1) + static_cast<char>(100 + row);  // 8 of the same,
      bytes += '\x08';                                                 // 8 as they are.
      for (int i = 0; i < 8; ++i) bytes += static_cast<char>(random.bits() & 0x7f);
    }
  }
  put_bytes(path("a.hdr"), bytes);
  ASSERT_NO_THROW(read_image(path("a.hdr")));
  damage("a.hdr", 1000);
}

TEST_F(DamagedFileTest, PngIsReadOrRefused) {
  std::vector<std::uint8_t> pixels(3 * 40 * 30);
  for (std::size_t i = 0; i < pixels.size(); ++i) pixels[i] = static_cast<std::uint8_t>(i * 7);
  write_png(path("a.png"), 40, 30, pixels);
  damage("a.png", 1000);
}

TEST(Image, LayersAreFoundByName) {
  Image image = small_image(2, 1);
  image.channels.push_back({"albedo.R", true, {1, 2}});
  image.channels.push_back({"albedo.G", true, {3, 4}});
  image.channels.push_back({"albedo.B", true, {5, 6}});
  EXPECT_EQ(image.layer("albedo")[1], Rgb(2, 4, 6));
  EXPECT_EQ(image.layer("")[0], Rgb(5, 4, 3));
  EXPECT_EQ(image.layer("beauty")[0], Rgb(5, 4, 3));
  EXPECT_EQ(image.layer("N")[0], Rgb(6, 7, 8));
  EXPECT_EQ(image.layer("Z")[1], Rgb(0.25f));
  EXPECT_THAT(image.layer_names(), testing::ElementsAre("", "N", "Z", "albedo", "diffuse_direct"));
  try {
    image.layer("nothing", "x.exr");
    FAIL();
  } catch (const Error& e) {
    EXPECT_EQ(e.kind(), ErrorKind::InvalidInput);
    EXPECT_THAT(e.what(), HasSubstr("x.exr"));
    EXPECT_THAT(e.what(), HasSubstr("beauty, N, Z, albedo"));
  }
}

TEST(Srgb, TransferFunctionsAreInverse) {
  for (double v = 0; v <= 1; v += 1.0 / 1024) EXPECT_NEAR(srgb_decoded(srgb_encoded(v)), v, 1e-9);
  EXPECT_NEAR(srgb_encoded(0.18), 0.4613561, 1e-6);
}

TEST_F(ImageFileTest, AStagedFileThatIsNotCommittedLeavesNothing) {
  {
    StagedFile staged(path("a"));
    EXPECT_TRUE(staged.write("abc", 3));
    EXPECT_EQ(files_in_folder(), 1u);
    EXPECT_FALSE(fs::exists(path("a")));
  }
  EXPECT_EQ(files_in_folder(), 0u);
  write_file_whole(path("a"), "abc");
  EXPECT_EQ(bytes_of(path("a")), "abc");
  EXPECT_EQ(files_in_folder(), 1u);
}

TEST_F(ImageFileTest, StagedFilesHonourTheUmask) {
  const mode_t old = umask(027);
  write_file_whole(path("a"), "abc");
  umask(old);
  struct stat info {};
  ASSERT_EQ(stat(path("a").c_str(), &info), 0);
  EXPECT_EQ(info.st_mode & 0777, 0640u);
}

}  // namespace
}  // namespace brume
